within ZeroshotRoom;
package BaseClasses "What the models have in common"

end BaseClasses;
